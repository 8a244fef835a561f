// One interactive panel: uPlot provides axes, cursor and selection; the marks are drawn here.
const root=document.documentElement;
const css=name=>getComputedStyle(root).getPropertyValue(name).trim();
let ROLES={};
const look=role=>({colour:css('--r-'+role),...ROLES[role]});
const HEIGHTS={tall:300,usual:210,low:120};
const ROW=42;
const BELOW=46;
const labelOf=a=>a.unit?`${a.quantity}, ${a.unit}`:a.quantity;
const frameHeight=(panel,width)=>panel.height==='rows'?ROW*panel.y.names.length:panel.height==='square'?Math.min(460,.8*(width-78)):HEIGHTS[panel.height];
// a view cannot be narrower than this fraction of the whole, because numbers have a limited number
// of digits
const NARROWEST=1e-6;
const lin=a=>a.scale!=='log';
const warp=(a,v)=>lin(a)?v:Math.log(v);
const unwarp=(a,v)=>lin(a)?v:Math.exp(v);
// [low, high] clamped to the full range of the axis
function held(axis,[low,high]){
  const[a,b]=axis.range.map(v=>warp(axis,v)),least=NARROWEST*(b-a);
  let l=Math.max(a,Math.min(b,warp(axis,Math.max(low,lin(axis)?-Infinity:Number.MIN_VALUE)))),h=Math.max(a,Math.min(b,warp(axis,high)));
  if(!(h-l>=least)){const m=Math.min(Math.max((l+h)/2||0,a+least),b-least);l=m-least;h=m+least}
  return[l<=a?axis.range[0]:unwarp(axis,l),h>=b?axis.range[1]:unwarp(axis,h)];
}
function zoomed(axis,[low,high],factor,centre){
  const l=warp(axis,low),h=warp(axis,high),m=centre===undefined?(l+h)/2:warp(axis,centre);
  return held(axis,[unwarp(axis,m-(m-l)*factor),unwarp(axis,m+(h-m)*factor)]);
}
function axisTicks(axis,view,length,up){
  if(axis.names){
    let free=-Infinity;
    const per=length/(view[1]-view[0]);
    return axis.names.map((label,value)=>({value,label})).filter(t=>t.value>=view[0]&&t.value<=view[1]).map(t=>{
      const at=(t.value-view[0])*per,half=3.65*t.label.length;
      if(!up&&at-half<free)return{value:t.value,label:''};
      free=at+half+8;return t;
    });
  }
  if(axis.every&&(view[1]-view[0])/axis.every>=2)return ticksEvery(view[0],view[1],axis.every);
  return ticks(axis.scale,view[0],view[1],length,up);
}
// whether an axis can be both linear and logarithmic: not names, not degrees, not values that
// change sign
const canSpread=(panel,key)=>{const a=panel[key];return!a.names&&!a.every&&a.link!=='cycle'&&a.range[0]>=0&&a.range[1]>0&&!(key==='y'&&panel.height==='rows')};
class Chart{
  constructor(figure,panel,host){
    this.figure=figure;this.panel=panel;this.host=host;this.hidden=new Set();
    this.view={x:[...panel.x.range],y:[...panel.y.range]};
    this.first={x:{scale:panel.x.scale,range:panel.x.range},y:{scale:panel.y.scale,range:panel.y.range}};
    this.make();
    new ResizeObserver(()=>{const w=host.clientWidth;if(w&&Math.abs(w-this.plot.width)>1)this.plot.setSize({width:w,height:this.height(w)})}).observe(host);
  }
  make(){
    const{panel,host}=this;
    const rows=panel.height==='rows';
    const axis=(own,key,up)=>({
      scale:key,stroke:()=>css('--ink'),grid:{stroke:()=>css('--grid'),width:1},ticks:{stroke:()=>css('--frame'),size:5,width:1},
      font:'12px '+FONT,labelFont:'13px '+FONT,label:up&&own.names?undefined:labelOf(own),labelSize:up?18:20,size:up?(own.names?16+6.6*Math.max(...own.names.map(n=>n.length)):46):26,gap:4,
      space:0,incrs:[1],
      splits:u=>{
        const length=up?u.bbox.height/devicePixelRatio:u.bbox.width/devicePixelRatio;
        this[key+'Ticks']=axisTicks(own,this.view[key],Math.max(length||0,40),up);
        return this[key+'Ticks'].map(t=>t.value);
      },
      values:(u,splits)=>splits.map(v=>{const t=(this[key+'Ticks']||[]).find(t=>t.value===v);return t?t.label:''}),
      filter:(u,splits)=>splits,
    });
    const scale=(own,key)=>({time:false,auto:false,distr:own.scale==='log'?3:1,range:()=>this.view[key],dir:key==='y'&&own.names?-1:1});
    const y=axis(panel.y,'y',true);
    if(rows){y.show=true;y.size=4;y.splits=()=>[];y.values=()=>[];y.grid={show:false};y.ticks={show:false}}
    if(panel.x.names)axis.grid={show:false};
    const width=host.clientWidth||600;
    this.plot=new uPlot({
      mode:2,width,height:this.height(width),pxAlign:false,legend:{show:false},padding:[10,20,0,rows?8:0],
      cursor:{points:{show:false},drag:{x:true,y:true,uni:24,setScale:false},dataIdx:()=>null,focus:{prox:-1}},
      scales:{x:scale(panel.x,'x'),y:scale(panel.y,'y')},
      axes:[axis(panel.x,'x',false),y],
      series:[null,{paths:()=>null,points:{show:false},facets:[{scale:'x',auto:false},{scale:'y',auto:false}]}],
      hooks:{draw:[u=>this.draw(u)],setCursor:[u=>this.onCursor(u)],setSelect:[u=>this.onSelect(u)]},
    },[null,[this.view.x,this.view.y]],host);
    const over=this.plot.over;
    over.addEventListener('wheel',e=>{
      // the wheel must scroll the page, so it zooms only after a click or with Ctrl
      if(!e.ctrlKey&&!host.closest('figure').contains(document.activeElement))return;
      e.preventDefault();
      const factor=e.deltaY<0?.8:1.25,at=this.plot.posToVal(e.offsetX,'x');
      this.zoom({x:zoomed(panel.x,this.view.x,factor,at)});
    },{passive:false});
    over.addEventListener('dblclick',()=>this.whole());
  }
  // makes the axis `key` linear or logarithmic; its full range is then the part that can be shown
  // so
  spread(key,scale){
    const axis=this.panel[key],first=this.first[key];
    if(axis.scale===scale||!canSpread(this.panel,key))return;
    const[low,high]=first.range;
    axis.range=scale===first.scale?first.range:scale==='log'?[low>0?low:this.least(key,high),high]:[0,high];
    axis.scale=scale;
    this.view[key]=[...axis.range];
    this.plot.destroy();
    this.make();
  }
  // the smallest positive value, but at most six decades below the largest
  least(key,high){
    let least=high;
    for(const m of this.panel.marks){
      const s=m.line||m.loop||m.points,list=s&&s[key];
      if(!list)continue;
      const at=key==='x'?along(list):i=>list[i],n=countOf(s.x,s.y);
      for(let i=0;i<n;i++){const v=at(i);if(v>0&&v<least)least=v}
    }
    return Math.max(least<high?least:high/10,high*1e-6);
  }
  height(width){return Math.round(frameHeight(this.panel,width)+BELOW+(this.panel.title?0:0)+10)}
  marks(){return this.panel.marks.filter(m=>!m.name||!this.hidden.has(m.name))}
  draw(u){
    const k=devicePixelRatio,ctx=u.ctx,b=u.bbox,box={left:b.left,top:b.top,right:b.left+b.width,bottom:b.top+b.height};
    const pen=new CanvasPen(ctx,k,css('--paper'),css('--ink'));
    ctx.save();ctx.beginPath();ctx.rect(b.left,b.top,b.width,b.height);ctx.clip();
    const sx=v=>this.panel.x.scale==='log'&&v<=0?NaN:u.valToPos(v,'x',true),sy=v=>this.panel.y.scale==='log'&&v<=0?NaN:u.valToPos(v,'y',true);
    for(const mark of this.marks())drawMark(pen,mark,sx,sy,box,look(mark.role));
    if(this.panel.height==='rows')this.panel.y.names.forEach((n,i)=>pen.text(b.left+8*k,sy(i)-3*k,n,'start','ink',13));
    ctx.restore();
    ctx.strokeStyle=css('--frame');ctx.lineWidth=k;ctx.strokeRect(b.left,b.top,b.width,b.height);
    this.drawn=(this.drawn||0)+1;
  }
  onSelect(u){
    const s=u.select;
    if(s.width<4&&s.height<4)return;
    const view={};
    if(s.width>4)view.x=held(this.panel.x,[u.posToVal(s.left,'x'),u.posToVal(s.left+s.width,'x')]);
    if(s.height>4&&this.panel.height!=='rows'){const a=u.posToVal(s.top+s.height,'y'),b=u.posToVal(s.top,'y');view.y=held(this.panel.y,[Math.min(a,b),Math.max(a,b)])}
    u.setSelect({left:0,top:0,width:0,height:0},false);
    this.zoom(view);
  }
  // zooms this panel and the others with the same links
  zoom(view){
    this.show(view);
    for(const key of['x','y'])if(view[key]&&this.panel[key].link)link(this,this.panel[key].link,view[key]);
    remember(this);
  }
  show(view){
    if(view.x)this.view.x=held(this.panel.x,view.x);
    if(view.y)this.view.y=held(this.panel.y,view.y);
    this.plot.batch(()=>{
      this.plot.setScale('x',{min:this.view.x[0],max:this.view.x[1]});
      this.plot.setScale('y',{min:this.view.y[0],max:this.view.y[1]});
    });
  }
  whole(){this.zoom({x:[...this.panel.x.range],y:[...this.panel.y.range]})}
  onCursor(u){
    if(u.cursor.left==null||u.cursor.left<0)return;
    const x=u.posToVal(u.cursor.left,'x'),words=this.words(x,u.cursor.left,u.cursor.top);
    const out=this.host.closest('figure').querySelector('.readout');
    if(out&&words)out.textContent=words;
  }
  // the values of all curves at x
  words(x,left,top){
    if(this.figure.name==='interface-modes')return modeWords(this,x,top);
    const p=this.panel,parts=[];
    let nearest=[18,''];
    for(const m of this.marks()){
      const c=m.line||m.loop,pt=m.points;
      if(m.line&&m.name){const i=nearestOf(c,x);if(i>=0&&Number.isFinite(c.y[i]))parts.push(`${m.name} ${sixDigits(c.y[i])}`)}
      if(m.strips){const row=Math.round(this.plot.posToVal(top,'y')),i=nearestOf({x:m.strips.x,y:m.strips.x},x);if(m.strips.says[row])return`${m.strips.says[row]}: ${sixDigits(m.strips.values[row*m.strips.x.length+i])} at ${sixDigits(m.strips.x[i])} ${p.x.unit}`}
      if(pt)for(let i=0;i<pt.x.length;i++){
        const d=Math.hypot(this.plot.valToPos(pt.x[i],'x')-left,this.plot.valToPos(pt.y[i],'y')-top);
        if(d<nearest[0])nearest=[d,(pt.says&&pt.says[i])||`${m.name} ${sixDigits(pt.y[i])}`];
      }
    }
    if(nearest[1])return nearest[1];
    if(p.x.names||p.height==='rows')return parts.join(' · ');
    return[`${p.x.quantity} ${sixDigits(x)} ${p.x.unit}`,...parts.map(t=>`${t} ${p.y.unit}`)].join(' · ');
  }
  // steps from one point to the next, in order of position
  stepPoint(by){
    const p=this.panel,along=p.height==='rows'?'y':'x',all=[];
    for(const m of this.marks())if(m.points)for(let i=0;i<m.points.x.length;i++)all.push({x:m.points.x[i],y:m.points.y[i],m,i});
    if(!all.length)return false;
    all.sort((a,b)=>a[along]-b[along]);
    this.point=this.point===undefined?0:Math.max(0,Math.min(all.length-1,this.point+by));
    const{x,y,m,i}=all[this.point],u=this.plot;
    u.setCursor({left:u.valToPos(x,'x'),top:u.valToPos(y,'y')});
    const said=(m.points.says&&m.points.says[i])||`${m.name} ${sixDigits(x)} ${p.x.unit}, ${sixDigits(y)} ${p.y.unit}`;
    this.host.closest('figure').querySelector('.readout').textContent=said;
    return true;
  }
  step(by){
    const first=this.panel.marks.find(m=>m.line&&m.name)||this.panel.marks.find(m=>m.line),u=this.plot;
    if(!first&&this.stepPoint(by))return;
    const at=u.cursor.left>=0?u.posToVal(u.cursor.left,'x'):(this.view.x[0]+this.view.x[1])/2;
    let x;
    if(first){const c=first.line,n=countOf(c.x,c.y),i=Math.max(0,Math.min(n-1,nearestOf(c,at)+by));x=along(c.x)(i)}
    else x=at+by*(this.view.x[1]-this.view.x[0])/100;
    x=Math.min(Math.max(x,this.view.x[0]),this.view.x[1]);
    u.setCursor({left:u.valToPos(x,'x'),top:u.cursor.top>=0?u.cursor.top:20});
  }
}
const sixDigits=v=>{const r=+(+v).toPrecision(6);return Math.abs(r)>=1e9||(r!==0&&Math.abs(r)<1e-4)?r.toExponential():String(r)};
function nearestOf(c,x){
  const n=countOf(c.x,c.y);
  if(c.x.length===undefined)return Math.max(0,Math.min(n-1,Math.round((x-c.x.first)/c.x.step)));
  let best=-1,d=Infinity;
  for(let i=0;i<n;i++){const e=Math.abs(c.x[i]-x);if(e<d){d=e;best=i}}
  return best;
}
