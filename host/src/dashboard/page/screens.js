// The screens: each creates its elements once and updates them when messages arrive.
function el(tag,options={},...children){
  const e=document.createElement(tag);
  for(const[k,v]of Object.entries(options))if(k==='on')for(const[type,f]of Object.entries(v))e.addEventListener(type,f);else if(k in e)e[k]=v;else e.setAttribute(k,v);
  e.append(...children);
  return e;
}
// a sign for each verdict, so that they can be distinguished without colour
const SIGNS={good:'✓','double hit':'≡',overload:'⊓',noisy:'~',weak:'↓',strong:'↑',mistimed:'⇄',gap:'…',dropped:'–'};
const signOf=v=>SIGNS[v]||'✕';
const fixed=(v,n)=>v===null||v===undefined?'–':v.toFixed(n);
function duration(s){
  s=Math.round(s);
  return s<100?s+' s':s<6000?Math.round(s/60)+' min':Math.floor(s/3600)+' h '+Math.floor(s%3600/60)+' min';
}
let chosen=null;     // the cell that is shown; null follows the newest hit
let held=false;      // the picture is frozen
const latest=()=>state.whole.hits.at(-1)||null;
const looked=()=>chosen??latest()?.cell??state.whole.cells[0]?.id;
const hitsOf=cell=>state.whole.hits.filter(h=>h.cell===cell);
function hitRow(h){
  return el('tr',{className:h.kept?'kept':'refused'},
    el('td',{},String(h.record)),el('td',{},String(h.attempt+1)),
    el('td',{},el('b',{'aria-hidden':'true'},signOf(h.verdict)),' '+h.verdict+(h.judged?` (was ${h.judged})`:'')),
    el('td',{},fixed(h.peak_n,1)+' N'),el('td',{},h.pulse_us+' µs'),el('td',{className:'why'},h.sentence),...editCell(h));
}
const hitHead=()=>el('thead',{},el('tr',{},...['record','attempt','verdict','peak','pulse','why',...(mine.edits?['']:[])].map(t=>el('th',{scope:'col'},t))));
const said=e=>e?.lines.map(([head,text])=>el('p',{},el('b',{},head),' '+text))||[el('p',{className:'absent'},'The analysis has no result yet.')];
const SCREENS=[
  {key:'now',title:'Now',make(m){
    this.next=m.appendChild(el('p',{className:'next',id:'next'}));
    this.answers=m.appendChild(el('div',{id:'answers'}));
    const grid=m.appendChild(el('div',{className:'two'}));
    const left=grid.appendChild(el('div')),right=grid.appendChild(el('div'));
    this.hit=left.appendChild(el('div'));
    this.force=left.appendChild(el('div'));
    left.append(el('h2',{},'Hits of this cell'));
    this.rows=el('tbody');
    left.append(el('div',{className:'scroll'},el('table',{},hitHead(),this.rows)));
    right.append(el('h2',{},'So far'));
    this.answer=right.appendChild(el('div',{className:'found'}));
    this.frf=right.appendChild(el('div'));
    this.geometry=right.appendChild(el('div'));
  },show(kind){
    const w=state.whole,s=w.now.state,at=s?.cell==null||s.what==='ended'?-1:w.cells.findIndex(c=>c.id===s.cell),n=at>=0?at:w.progress.next,h=latest();
    this.next.textContent=w.progress.complete?'The campaign is complete.':n===null?'No cell is open: the rest was given up.':`Next: ${nameOf(w.cells[n])}, hit ${w.cells[n].kept+1} of ${w.cells[n].wanted}`;
    answersShown(this.answers);
    this.rows.replaceChildren(...(h?hitsOf(h.cell):[]).map(hitRow));
    if(h){
      picture(this.hit,`/api/records/${h.record}/hit`);
      picture(this.force,`/api/records/${h.record}/force`);
      // the address changes with every hit that is kept or dropped
      picture(this.frf,`/api/cells/${h.cell}/frf?${hitsOf(h.cell).filter(o=>o.kept).map(o=>o.record).join('.')}`);
    }
    this.answer.replaceChildren(...said(w.estimate));
    const place=n===null?h?.cell:w.cells[n].id;
    if(place!==undefined)picture(this.geometry,`/api/cells/${place}/place`);
  }},
  matrixScreen,
  {key:'cell',title:'Cell',make(m){
    this.head=m.appendChild(el('h2',{id:'cell-name'}));
    this.note=m.appendChild(el('p',{className:'say'}));
    this.hits=m.appendChild(el('div'));
    this.rows=el('tbody');
    m.append(el('div',{className:'scroll'},el('table',{},hitHead(),this.rows)));
  },show(kind){
    const id=looked(),c=id===undefined?null:cellOf(id);
    if(!c){this.head.textContent='The plan has no cells.';return}
    const own=hitsOf(id);
    this.head.textContent=nameOf(c);
    this.note.textContent=`${c.kept} of ${c.wanted} kept, ${c.attempts} tried.`+(c.given_up?' Given up: '+c.given_up+'.':'')+(c.settled?' Settled: '+c.settled+'.':'')+(chosen===null?' Follows the newest hit.':' Press f to follow the newest hit.');
    this.rows.replaceChildren(...own.map(hitRow));
    if(own.length)picture(this.hits,`/api/cells/${id}/hits?${own.length}`);else{shownFigures.delete(this.hits);this.hits.replaceChildren(el('p',{className:'absent'},'No hits yet.'))}
  }},
  figureScreen('stiffness','Stiffness',['answer','budget','k-t-of-frequency','levels','joint-spectrum'],true),
  figureScreen('frfs','Driving points',['receptances','coherence','random-error'],false),
  scopeScreen,
  {key:'log',title:'Log',make(m){
    this.filter=el('input',{type:'search',placeholder:'search',id:'log-search','aria-label':'search the log',on:{input:()=>this.sift()}});
    m.append(el('p',{},this.filter));
    this.rows=el('tbody');
    m.append(el('div',{className:'scroll'},el('table',{},el('thead',{},el('tr',{},...['when','what'].map(t=>el('th',{scope:'col'},t)))),this.rows)));
    this.last=0;this.shown=0;
  },async show(){
    const lines=await ask('/api/log?after='+this.last)||[];
    const put=(utc,text,refused)=>{
      const when=utc.slice(0,19).replace('T',' '),row=el('tr',{className:refused?'refused':''},el('td',{},when),el('td',{className:'why'},text));
      row.when=utc;
      // newest first
      const below=[...this.rows.rows].find(r=>r.when<=utc);
      this.rows.insertBefore(row,below||null);
    };
    for(const l of lines){if(l.id<=this.last)continue;this.last=l.id;put(l.utc,l.text,false)}
    const hits=state.whole.hits;
    for(;this.shown<hits.length;this.shown++){const h=hits[this.shown];if(!h.kept)put(h.utc,`${nameOf(cellOf(h.cell)||{configuration:'',impact:'?',response:'?'})}, record ${h.record}: ${h.verdict}: ${h.sentence}`,true)}
    this.sift();
  },sift(){const t=this.filter.value.toLowerCase();for(const r of this.rows.rows)r.hidden=!!t&&!r.textContent.toLowerCase().includes(t)}},
  shakerScreen,
];
function figureScreen(key,title,names,words){
  return{key,title,make(m){
    if(words)this.words=m.appendChild(el('div',{className:'found'}));
    this.missing=m.appendChild(el('ul',{className:'missing'}));
    this.hosts=names.map(n=>[n,m.appendChild(el('div'))]);
  },show(){
    const e=state.whole.estimate;
    if(words)this.words.replaceChildren(...said(e),...(e?[el('p',{className:'say'},`After record ${e.after_record}: ${e.hits} good hits, analysed in ${e.took_s.toFixed(1)} s.`)]:[]));
    this.missing.replaceChildren(...(words?(e?.missing||[]).map(t=>el('li',{},t)):[]));
    for(const[n,host]of this.hosts){
      const there=e?.figures.includes(n);
      host.hidden=!there;
      if(there)picture(host,'/api/figures/'+n,this.known!==e.seq);
    }
    if(e)this.known=e.seq;
  }};
}
