// The matrix of cells; each cell shows its verdicts or a number.
const VIEWS=[
  {title:'verdicts',say:'Every cell: hits kept of those wanted.'},
  {title:'force',say:'Mean peak force of the good hits, N.',of:n=>n.force_n,number:v=>v.toFixed(1),text:v=>v.toFixed(1)+' N'},
  {title:'random error',say:'Random error of the FRF, median from 300 Hz to 600 Hz, %, from the last analysis.',of:n=>n.random_error_percent,number:v=>v.toPrecision(2),text:v=>v.toPrecision(2)+' %'},
  {title:'coherence',say:'Coherence, median from 300 Hz to 600 Hz, from the last analysis.',of:n=>n.coherence,number:v=>v.toFixed(3),text:v=>v.toFixed(3)},
];
const matrixScreen={key:'matrix',title:'Matrix',make(m){
  this.buttons=VIEWS.map(v=>el('button',{type:'button',on:{click:()=>{this.view=v;this.show()}}},v.title));
  m.append(el('div',{className:'views',role:'group','aria-label':'what the cells show'},...this.buttons));
  this.about=m.appendChild(el('p',{className:'say',id:'matrix-say'}));
  this.tables=m.appendChild(el('div'));
  this.cells=new Map();this.ids=null;this.view??=VIEWS[0];this.known=null;this.numbers??=new Map();
},show(){
  const w=state.whole,ids=w.cells.map(c=>c.id).join();
  if(this.ids!==ids){
    this.ids=ids;this.cells.clear();this.tables.replaceChildren();
    for(const conf of new Set(w.cells.map(c=>c.configuration))){
      const own=w.cells.filter(c=>c.configuration===conf),impacts=[...new Set(own.map(c=>c.impact))],responses=[...new Set(own.map(c=>c.response))];
      const body=el('tbody');
      for(const r of responses)body.append(el('tr',{},el('th',{scope:'row'},r),...impacts.map(i=>{
        const c=own.find(c=>c.impact===i&&c.response===r),td=el('td');
        if(c){const b=el('button',{type:'button',on:{click:()=>{chosen=c.id;go('cell')}}});td.append(b);this.cells.set(c.id,b)}
        return td;
      })));
      this.tables.append(el('h2',{},conf),el('div',{className:'scroll'},el('table',{className:'matrix'},el('thead',{},el('tr',{},el('th',{},''),...impacts.map(i=>el('th',{scope:'col'},i)))),body)));
    }
  }
  VIEWS.forEach((v,i)=>this.buttons[i].setAttribute('aria-pressed',String(v===this.view)));
  if(this.view.of)this.learn();
  const shown=this.view.of?[...this.numbers.values()].map(this.view.of).filter(v=>v!==null):[],ends=[Math.min(...shown),Math.max(...shown)];
  this.about.textContent=this.view.say+(shown.length>1?` The fuller the cell, the larger: from ${this.view.text(ends[0])} to ${this.view.text(ends[1])}.`:'')+(shown.length<w.cells.length&&this.view.of?' – is not yet known.':'')+' Choose a cell to see its hits.';
  const next=w.progress.next===null?null:w.cells[w.progress.next].id;
  for(const c of w.cells){
    const b=this.cells.get(c.id),refused=Object.entries(c.refused).map(([v,n])=>`${n} ${v}`).join(', ');
    if(!b)continue;
    const n=this.numbers.get(c.id),value=this.view.of&&n?this.view.of(n):null;
    b.textContent=c.given_up?'✕':`${c.kept}/${c.wanted}`;
    b.className=c.given_up?'given-up':c.kept>=c.wanted||c.settled?'done':c.attempts?'begun':'open';
    if(this.view.of){
      b.textContent=value===null?'–':this.view.number(value);
      b.className=value===null?'open':'number';
      b.style.setProperty('--full',value===null?'0%':(ends[1]>ends[0]?100*(value-ends[0])/(ends[1]-ends[0]):100).toFixed(0)+'%');
    }
    if(c.id===next)b.classList.add('coming');
    const number=this.view.of&&`${this.view.title}: ${value===null?'not yet':this.view.text(value)}`;
    const why=[nameOf(c)+(number?', '+number:'')+`: ${c.kept} of ${c.wanted} kept`,refused&&'refused: '+refused,c.given_up&&'given up: '+c.given_up,c.settled&&'settled: '+c.settled].filter(Boolean).join('; ');
    b.title=why;b.setAttribute('aria-label',why);
  }
},async learn(){
  // the numbers change with hits, verdicts and analyses
  const w=state.whole,known=[w.hits.length,w.hits.filter(h=>h.kept).length,w.estimate?.after_record,w.estimate?.seq].join();
  if(this.known===known)return;
  this.known=known;
  const numbers=await ask('/api/matrix');
  if(!numbers){this.known=null;return}
  this.numbers=new Map(numbers.map(n=>[n.cell,n]));
  if(screen===this)this.show();
}};
